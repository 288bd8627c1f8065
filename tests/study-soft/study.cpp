#include "plant/soft/reduced_plant.hpp"
#include "base/random.hpp"
#include "base/error.hpp"
#include <cstdio>
#include <cstdlib>
#include <chrono>
#include <vector>
using namespace ulna;
using Clock=std::chrono::steady_clock;
struct Out{double slope=0,gt=0,maxslip=0,ms[6]{},pk=0,slide=0,wall=0,mu=0,rms=0;std::vector<double> el;};
Out go(const SoftPlant&p,double act){
  std::vector<Change> ch; for(int j=0;j<4;j++)ch.push_back({ModelQuantity::kJointDamping,"J"+std::to_string(j+1),{16.0}});
  EngineRun run(p.model().changed(ch));
  Vector q(4);q<<0,-90*kDegree,0,110*kDegree;
  Out o;auto t0=Clock::now();
  p.attach(run,q);double g0=run.position()[7]-run.position()[3];
  Vector I=Vector::Zero(4);double T0=4,dt=run.model().timestep();
  double n=0,sx=0,sy=0,sxx=0,sxy=0,st=0,sxt=0,sq=0,sqq=0,sqy=0;
  int tick=0;
  for(int i=0;i<int((T0+6)/dt+.5);i++){
    double t=i*dt,x0=110*kDegree,ref=x0; if(t>T0)ref=x0*(1-1/(1.1*(1+std::exp(5-2*(t-T0)))));
    Vector r=q;r[3]=ref;Vector e=r-run.position().head(4);I+=e*dt;
    for(int j=0;j<4;j++)run.control()[j]=std::clamp((j==1?800:50)*e[j]+25*I[j],-60.,60.);
    for(int j=4;j<12;j++)run.control()[j]=t>0.5?act:0.;
    double el=run.position()[7],J4=run.position()[3],tau=run.control()[3]-15*run.velocity()[3];
    run.step();
    double sl=(el-J4-g0)/kDegree;
    if(t>T0){ o.maxslip=std::max(o.maxslip,std::abs(sl));
      double Q=J4,gt=run.actuator_torque()[7],y=-tau-2.787*(run.velocity()[3]<0?-1:1)*-1;
      n++;sx+=el;sxx+=el*el;sy+=y;sxy+=el*y;st+=gt;sxt+=el*gt;sq+=Q;sqq+=Q*Q;sqy+=Q*y;
      if(i%40==0)o.el.push_back(el);
      for(auto&x:interface_reports(run)){o.pk=std::max(o.pk,x.cuff.peak_pressure);o.slide=std::max(o.slide,x.sliding.norm());}
    }
    tick++;
  }
  o.slope=(n*sqy-sq*sy)/(n*sqq-sq*sq);o.gt=(n*sxt-sx*st)/(n*sxx-sx*sx);
  o.wall=std::chrono::duration<double>(Clock::now()-t0).count();
  return o;
}
int main(int c,char**v){
  int N=atoi(v[1]),first=atoi(v[2]);bool reduced=c>3&&atoi(v[3]);int fit=c>4?atoi(v[4]):1;double act=c>5?atof(v[5]):.4;
  for(int s=first;s<first+N;s++){
    Random rnd(7,(unsigned)s);
    double u[6];for(double&x:u)x=rnd.uniform();
    double x1=.7501+u[0]*(1.0388-.7501),x2=.81+u[1]*.18,m1=.3+u[2]*3.11,m2=.1+u[3]*1.72,k1=100.5+u[4]*873.93,k2=100.5+u[5]*873.93;
    if(!fit){x1=.9+u[0]*.2;x2=.9+u[1]*.2;}
    try{
      ExoScene es;es.arm=ArmDescription::cylinders(x1,x2,m1,m2);
      SoftScene sc=SoftScene::of(es);sc.interfaces[0].tissue.stiffness=k1;sc.interfaces[1].tissue.stiffness=k2;
      if(getenv("PRE"))for(auto&i:sc.interfaces)i.strap.pretension=atof(getenv("PRE"));
      if(getenv("FR"))for(auto&i:sc.interfaces)i.friction=atof(getenv("FR"));if(getenv("SQ"))for(auto&i:sc.interfaces)i.cuff.squeeze=atof(getenv("SQ"));
      if(getenv("CX")){double dx=atof(getenv("CX"))-.1208;sc.interfaces[0].centre.x()+=dx*x1;sc.interfaces[0].cuff.position.z()+=dx;}
      if(fit)fit_device(sc,x1,x2);
      SoftPlant p(sc);
      Out f=go(p,act);
      printf("%d k %.0f %.0f x %.3f %.3f m %.2f %.2f slip %.2f slide %.1f mm pk %.0f kPa slopeJ4 %.3f gt %.3f wall %.2f",s,k1,k2,x1,x2,m1,m2,f.maxslip,f.slide*1e3,f.pk/1e3,f.slope,f.gt,f.wall);
      if(reduced){auto t0=Clock::now();ReductionOptions ro;ro.activation=act;if(getenv("HOLD"))ro.hold=atof(getenv("HOLD"));if(getenv("RAMP"))ro.ramp=atof(getenv("RAMP"));if(getenv("AMP")){ro.shift=atof(getenv("AMP"))*1e-3;ro.turn=atof(getenv("AMP"))*.7*kDegree;}if(getenv("ELB"))ro.elbow=atof(getenv("ELB"))*kDegree;Reduction r=reduce(p,ro);double tr=std::chrono::duration<double>(Clock::now()-t0).count();Out g=go(p.reduced(r.bushings),act);
        double d=0;for(size_t i=0;i<g.el.size();i++)d+=std::pow(g.el[i]-f.el[i],2);
        printf(" | red slip %.2f slopeJ4 %.3f gt %.3f wall %.3f reduce %.2f el rms %.2f deg asym %.2f %.2f %.2f %.2f lin %.2f %.2f",g.maxslip,g.slope,g.gt,g.wall,tr,std::sqrt(d/g.el.size())/kDegree,r.asymmetry[0],r.asymmetry[1],r.asymmetry[2],r.asymmetry[3],r.linearity[0],r.linearity[2]);}
      printf("\n");
    }catch(const Error&e){printf("%d x %.3f %.3f k %.0f %.0f ERROR %s\n",s,x1,x2,k1,k2,e.what());}
    fflush(stdout);
  }
}
